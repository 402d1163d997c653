from pathlib import Path
STANDALONE = Path(__file__).with_name("standalone")
