"""The durable record of a study: logs of frames, their recovery, and the index of the records that count."""
