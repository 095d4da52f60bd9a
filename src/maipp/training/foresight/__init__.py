"""Training of the learned foresight: routes, fresh fields on them, and the network that reads what they measured."""
