def settings_of(controller, *, single):
    return []
