"""Kinds of mobile bases: differential, skid steering, mecanum, tricycle."""
