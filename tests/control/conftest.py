"""Robots and controllers that many tests share."""

import pytest

import optiplan as op


@pytest.fixture(scope="session")
def panda():
    return op.load_robot("panda")


@pytest.fixture(scope="session")
def delbot():
    return op.load_robot("delbot")


@pytest.fixture(scope="session")
def baxter():
    return op.load_robot("baxter")
