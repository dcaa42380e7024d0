"""Reports: results as plain data that scripts can rely on."""
