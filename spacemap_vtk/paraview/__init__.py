"""The layer for ParaView: a plugin that is generated from the parameters' declarations."""
