"""Trade studies: a vehicle with other values of its entries, each design built and flown, in one table."""
