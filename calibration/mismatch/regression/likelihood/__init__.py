"""How far readings are to be trusted: noise of any spectrum, and errors that last or vary."""
