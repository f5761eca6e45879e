"""Vehicle files of FASTSim and SUMO."""
