"""The proving ground of flow: two stores in a row, in fine steps."""
