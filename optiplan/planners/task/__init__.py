"""Planning of tasks: goal configurations from which the steps that follow can be done, and motions that flow."""
