"""The ladder of models: answers, time and errors of each model side by side, and audits."""
