"""Files of loggers and programs: MAT, TDMS, MDF, Parquet."""
