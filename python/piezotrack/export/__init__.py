"""Controllers for firmware and for other programs."""
