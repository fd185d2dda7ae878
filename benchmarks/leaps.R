# Best subsets of every size by the R package leaps, for comparison.
# Usage: Rscript leaps.R data.csv repetitions result.csv     (last column of data.csv = response)
suppressPackageStartupMessages(library(leaps))
arguments <- commandArgs(trailingOnly = TRUE)
data <- as.matrix(read.csv(arguments[1]))
p <- ncol(data) - 1
seconds <- Inf
for (repetition in seq_len(as.integer(arguments[2]))) {
  taken <- system.time(
    found <- regsubsets(data[, 1:p], data[, p + 1], nvmax = p, nbest = 1, really.big = TRUE)
  )[["elapsed"]]
  seconds <- min(seconds, taken)
}
which <- summary(found)$which[, -1, drop = FALSE]
write.csv(
  data.frame(
    size = rowSums(which),
    rss = format(summary(found)$rss, digits = 15),
    columns = apply(which, 1, function(row) paste(which(row) - 1, collapse = " ")),
    seconds = seconds
  ),
  arguments[3],
  row.names = FALSE
)
