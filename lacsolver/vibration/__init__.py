"""Free vibration: a problem linearised about its undeformed bodies or about a state, and its natural modes."""
