"""Pictures of a camera: single ones for ``take_photo``, a sequence for video."""
