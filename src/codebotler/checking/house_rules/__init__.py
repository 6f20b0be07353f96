"""Files of house rules: read, reviewed by examples, and searched for loopholes."""
