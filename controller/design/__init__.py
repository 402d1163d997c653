"""Design tools: linearised plant, loop margins, stick-slip limit cycles."""
