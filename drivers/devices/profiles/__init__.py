"""Devices that `rover.toml` describes: a profile, the maker's EDS file, and what differs from both.

profile     what a profile is: where each quantity may lie, in which unit
shipped     the profiles that come with regolithd: EPOS2, EPOS4, CiA 402, CiA 404, CiA 401
choice      what `rover.toml` says about a kind of device, or about one node
compose     profile, EDS file and choice together: a `Device`, or every reason why there is none
"""
