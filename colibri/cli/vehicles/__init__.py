"""Commands that fly vehicles of others: `colibri companion`."""
