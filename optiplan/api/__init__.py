"""The front door in Python: what `import optiplan` offers besides the classes of the rooms below."""
