"""What each rung of the ladder of models buys: answers, time and errors side by side, and audits."""
