#!/bin/sh
# thermcorr_memory.sh save | restore: start readings and memory while LinuxCNC is closed.
# They are in thermcorr_kept.txt beside the INI file; delete it to take new start readings.
kept=thermcorr_kept.txt
model=a6dda75b221d0a842068d1621f8510b36cdd362cdb3044be21d7c187f108c47f
case "$1" in
save)
    {
        echo "model $model"
        echo "saved-at $(date +%s)"
        for name in has-memory-1 start-1 has-start-1 has-memory-2 start-2 has-start-2; do
            value=$(halcmd -s getp "thermcorr.$name") || exit 1
            echo "$name $value"
        done
    } > "$kept.new" && mv "$kept.new" "$kept"
    ;;
restore)
    [ -r "$kept" ] || exit 0
    if [ "$(head -n 1 "$kept")" != "model $model" ]; then
        echo "$kept is of another model: start readings are taken anew" >&2
        exit 0
    fi
    while read -r name value; do
        case "$name" in
        model) ;;
        saved-at)
            off=$(($(date +%s) - value))
            # a clock that was put back says nothing: as after a long standstill
            [ "$off" -ge 0 ] || off=1000000
            halcmd setp thermcorr.standstill "$off"
            ;;
        *) halcmd setp "thermcorr.$name" "$value" ;;
        esac || exit 1
    done < "$kept"
    halcmd setp thermcorr.restart 1
    ;;
*)
    echo "usage: $0 save | restore" >&2
    exit 2
    ;;
esac
