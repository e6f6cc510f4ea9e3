"""Attributes of results that a type checker knows: the stub beside this file lists them."""


class StatisticNames:
    """The names of the statistics in `jaxcrusher.crusher.template.STATISTIC`."""


class ObservableNames:
    """The names of the observables in `jaxcrusher.crusher.template.OBSERVABLES`."""
