"""Device profiles: what each kind of node measures and how it is configured."""
