"""What runs for others: HTTP and the page, cars that learn and their messages, tools for assistants."""
