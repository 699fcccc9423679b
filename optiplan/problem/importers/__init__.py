"""Problems of other programs as problem files."""
