"""Layer for ParaView: a plugin that is generated from the declared parameters."""
