"""Golden scripts are tests: the plugin that users get by installing the package, here from the sources."""

pytest_plugins = ["gibiane.pytest_plugin"]
