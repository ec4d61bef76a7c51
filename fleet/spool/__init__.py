"""What must outlive the process: messages for the cloud on disk, and the files that it is kept in."""
