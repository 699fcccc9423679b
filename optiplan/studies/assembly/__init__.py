"""Jobs given to arms that stand side by side: which arm does which, and in which order."""
