"""Who may ask for what, and how often: keys, signed addresses, proxies that are believed, rates, other origins."""
