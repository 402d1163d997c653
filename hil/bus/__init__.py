"""The bus: frames from the DBC, fast codec, protection, and buses between processes, authenticated or not."""
