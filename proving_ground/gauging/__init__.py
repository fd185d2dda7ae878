"""The proving ground of gauged grinding: parts that are ground in time, one after the other."""
