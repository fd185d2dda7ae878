"""Which sizes come out, by formula; how capable that is, and which filter is best."""
