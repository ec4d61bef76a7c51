"""State that safety needs after a crash: begun commands and set emergency stops."""
