"""`capsule cockpit`: a page to watch a bus or a log through, and to steer by."""
