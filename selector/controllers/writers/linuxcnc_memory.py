"""What of a HAL component outlives LinuxCNC: a shell script saves its parameters at shutdown and gives them back."""

from __future__ import annotations

from collections.abc import Sequence


def memory_files(component: str, kept: Sequence[str], identity_sha256: str) -> dict[str, str]:
    """``<component>_memory.sh`` and ``<component>_shutdown.hal`` for parameters with these names in C.

    What was saved for another model is left alone: its first sensor may be another one.
    """
    parameters = " ".join(name.replace("_", "-") for name in kept)
    script = f"""\
#!/bin/sh
# {component}_memory.sh save | restore: start readings and memory while LinuxCNC is closed.
# They are in {component}_kept.txt beside the INI file; delete it to take new start readings.
kept={component}_kept.txt
model={identity_sha256}
case "$1" in
save)
    {{
        echo "model $model"
        echo "saved-at $(date +%s)"
        for name in {parameters}; do
            value=$(halcmd -s getp "{component}.$name") || exit 1
            echo "$name $value"
        done
    }} > "$kept.new" && mv "$kept.new" "$kept"
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
        saved-at) halcmd setp {component}.standstill $(($(date +%s) - value)) ;;
        *) halcmd setp "{component}.$name" "$value" ;;
        esac || exit 1
    done < "$kept"
    halcmd setp {component}.restart 1
    ;;
*)
    echo "usage: $0 save | restore" >&2
    exit 2
    ;;
esac
"""
    return {
        f"{component}_memory.sh": script,
        f"{component}_shutdown.hal": f"loadusr -w sh {component}_memory.sh save\n",
    }
