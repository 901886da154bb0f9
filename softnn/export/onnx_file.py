"""A network as ONNX: inputs (samples, columns) -> stress, and whether it was shown."""

from __future__ import annotations

import numpy as np

import softnn
from softnn.contracts import InputError
from softnn.export.network import stepped
from softnn.model_file import Stored
from softnn.neural import BoundedNetwork, StoredNetwork
from softnn.neural.guard import SLACK
from softnn.neural.inputs import FILTER_S

OPSET, IR_VERSION = 17, 8
# How the network's training made the rate; another one gives another stress.
RATE = (
    "backward difference: (strain now - strain one lag before) / lag, the lag being "
    "{lag}; the first sample takes the rate of the second"
)


def onnx_model(model: Stored | StoredNetwork) -> bytes:
    """The file: double precision, opset 17, scaling included.

    Input `inputs` (n, d) in the order of its metadata; outputs `stress_MPa` (n,) and
    `outside` (n,), whether any input lies beyond the ranges of the training. Lags and
    rates are for the caller to make, as ONNX has no memory.
    """
    if not isinstance(model, StoredNetwork):
        raise InputError(
            "ONNX is for networks: a model of springs, branches and effects has a "
            "memory; try --to c or --to fmu"
        )
    try:
        import onnx
        from onnx import TensorProto, helper, numpy_helper
    except ModuleNotFoundError:
        raise InputError("onnx is not installed; pip install softnn[export]") from None
    net, row = model.network, stepped(model)
    slack = SLACK * (net.inputs.high - net.inputs.low)
    constants = {
        "middle": (net.inputs.low + net.inputs.high) / 2,
        "half": net.inputs.half,
        "hidden": net.hidden[:, :-1].T,
        "hidden_bias": net.hidden[:, -1],
        "output": net.output[:-1],
        "output_bias": net.output[-1],
        "target_half": net.target.half,
        "target_middle": (net.target.low + net.target.high) / 2,
        "lowest": net.inputs.low - slack,
        "highest": net.inputs.high + slack,
    }
    if not all(np.isfinite(v).all() for v in constants.values()):
        raise InputError("the network holds NaN or infinity")
    bounded = isinstance(net, BoundedNetwork)
    steps = [
        ("Sub", ("known" if bounded else "inputs", "middle"), "centred"),
        ("Div", ("centred", "half"), "scaled"),
        ("MatMul", ("scaled", "hidden"), "weighed"),
        ("Add", ("weighed", "hidden_bias"), "excited"),
        ("Tanh", ("excited",), "layer"),
        ("MatMul", ("layer", "output"), "summed"),
        ("Add", ("summed", "output_bias"), "normal"),
        ("Mul", ("normal", "target_half"), "wide"),
        ("Add", ("wide", "target_middle"), "free" if bounded else "stress_MPa"),
        ("Less", ("inputs", "lowest"), "below"),
        ("Greater", ("inputs", "highest"), "above"),
        ("Or", ("below", "above"), "beyond"),
    ]
    if isinstance(net, BoundedNetwork):
        constants |= {"low": net.inputs.low, "high": net.inputs.high}
        constants["zero"] = np.zeros(())
        steps[:0] = [
            ("Max", ("inputs", "low"), "risen"),
            ("Min", ("risen", "high"), "known"),
        ]
        steps.append(("Max" if net.pulls else "Min", ("free", "zero"), "stress_MPa"))
    nodes = [helper.make_node(op, given, [out]) for op, given, out in steps]
    cast = helper.make_node("Cast", ["beyond"], ["counted"], to=TensorProto.INT32)
    most = helper.make_node("ReduceMax", ["counted"], ["any"], axes=[1], keepdims=0)
    back = helper.make_node("Cast", ["any"], ["outside"], to=TensorProto.BOOL)
    width = len(net.inputs.low)
    graph = helper.make_graph(
        [*nodes, cast, most, back],
        "softnn",
        [helper.make_tensor_value_info("inputs", TensorProto.DOUBLE, ["n", width])],
        [
            helper.make_tensor_value_info("stress_MPa", TensorProto.DOUBLE, ["n"]),
            helper.make_tensor_value_info("outside", TensorProto.BOOL, ["n"]),
        ],
        [
            numpy_helper.from_array(np.ascontiguousarray(v, np.float64), k)
            for k, v in constants.items()
        ],
    )
    made = helper.make_model(
        graph,
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
        producer_name="softnn",
        producer_version=softnn.__version__,
    )
    unit = FILTER_S if model.lag_s is None else model.lag_s
    timed = row.filters + row.branches or model.lag_s is not None
    lag = f"{unit!r} s" if timed else "one sample"
    helper.set_model_props(
        made,
        {
            "columns": ", ".join(row.names),
            "lag": lag,
            **({"strain_rate_per_s": RATE.format(lag=lag)} if row.rate else {}),
            "architecture": model.architecture,
        },
    )
    onnx.checker.check_model(made, full_check=True)
    return bytes(made.SerializeToString())
