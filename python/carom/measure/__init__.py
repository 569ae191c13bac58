"""Quantities measured from a result: events, closed contacts, granular measures."""
