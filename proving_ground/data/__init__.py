"""The proving ground of faulty readings: responses and inputs of heated machines and of axes, in one run or in all."""
