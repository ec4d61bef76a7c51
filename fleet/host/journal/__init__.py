"""State that safety needs after a crash: started commands and set emergency stops."""
