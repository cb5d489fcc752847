"""The golden flights on other computers: hashes to compare with, and what makes one computer into another."""
