"""The bus: frames of the DBC, codec, protection, and buses between processes, authenticated or not."""
