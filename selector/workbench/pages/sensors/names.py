"""The name of the page, with which the ids of all of its parts begin."""

ID = "sensors"
