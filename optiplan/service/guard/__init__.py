"""What stands before every answer: who may ask, how much, how often; and the record of it."""
