"""`sclerp`: the tool moves along one screw, by the schemes of the course report on Baxter and by a better one."""
