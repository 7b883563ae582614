"""What is measured, one study a module, with all problems, orders and sizes of its table."""
