# Best subsets of every size by the R packages leaps and lmSubsets, for comparison.
# Usage: Rscript leaps.R data.csv repetitions result.csv leaps|lmSubsets     (last column of data.csv = response)
arguments <- commandArgs(trailingOnly = TRUE)
program <- arguments[4]
suppressPackageStartupMessages(library(program, character.only = TRUE))
data <- as.matrix(read.csv(arguments[1]))
p <- ncol(data) - 1
x <- data[, 1:p]
y <- data[, p + 1]
search <- function() {
  if (program == "leaps") regsubsets(x, y, nvmax = p, nbest = 1, really.big = TRUE)
  else lmSubsets_fit(cbind(1, x), y, include = 1, nbest = 1)
}
seconds <- Inf
for (repetition in seq_len(as.integer(arguments[2]))) {
  seconds <- min(seconds, system.time(found <- search())[["elapsed"]])
}
if (program == "leaps") {
  which <- summary(found)$which[, -1, drop = FALSE]
  rss <- summary(found)$rss
} else {
  done <- !is.na(found$submodel$RSS)
  which <- as.matrix(found$subset)[done, -1, drop = FALSE] # the first is the intercept
  rss <- found$submodel$RSS[done]
}
write.csv(
  data.frame(
    size = rowSums(which),
    rss = format(rss, digits = 15),
    columns = apply(which, 1, function(row) paste(which(row) - 1, collapse = " ")),
    seconds = seconds
  ),
  arguments[3],
  row.names = FALSE
)
