"""What the robot is told: waypoints, workspace, reach, and files in the languages of robots."""
