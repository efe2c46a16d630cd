"""The paper's figures beside ours: what can be computed again, computed again (`regolithd reproduce`)."""
