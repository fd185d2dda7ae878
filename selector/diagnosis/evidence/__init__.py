"""The evidence: noise, tests of an effect against it, the search, the names and what they explain."""
