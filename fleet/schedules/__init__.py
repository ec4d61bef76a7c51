"""When missions start by themselves: triggers, what was fired, and what starts them."""
