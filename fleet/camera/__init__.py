"""Pictures of a camera: single ones for ``take_photo``, one after the other for video."""
