"""The proving ground of drives: true axes in fine steps, what a user's simulation says of them, what is concealed."""
