"""Proofs that hold at all times: collision, torque, polynomial bounds."""
