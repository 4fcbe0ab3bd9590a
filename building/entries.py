"""Entries of kernels: functions of numba that read their arguments from a table of words."""

from itertools import count
from typing import Any, get_args, get_type_hints

from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array
from numba.np.numpy_support import from_dtype

from lineament.kernels.library import REFUSED

WORD = ir.IntType(64)
_QUIET = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
#: Letters of NumPy for the numbers of an array; whole numbers of 64 bits have two names.
LETTERS = {"float64": b"d", "float32": b"f", "int64": b"lq", "int32": b"il", "int8": b"b"}


def _reader(kind: types.Type, code: ir.Type) -> Any:
    """Return the function that reads such a number at an address."""

    @intrinsic
    def read(context, address):  # noqa: ARG001
        def generate(context, builder, signature, values):  # noqa: ARG001
            return builder.load(builder.inttoptr(values[0], code.as_pointer()))

        return kind(types.int64), generate

    return read


word, real = _reader(types.int64, WORD), _reader(types.float64, ir.DoubleType())


@njit(**_QUIET)
def fits(header, head, dimensions, one, other):
    """Whether an array, by the header that NumPy has, is contiguous and of the type.

    After what each object of Python begins with, `head` bytes, an array has the addresses of its
    data, (dimensions), of its shape, strides, base and type, and its flags; a type has an address,
    and then its kind, letter and order of bytes. These are part of NumPy's public ABI.
    """
    letters = word(word(header + 40) + head + 8)
    letter, order = (letters >> 8) & 255, (letters >> 16) & 255
    return (
        (word(header + 8) & 0xFFFFFFFF) == dimensions
        and (word(header + 48) & 1) == 1
        and letter in (one, other)
        and order != 62  # ">": of a machine of the other kind
    )


def viewer(dtype: types.Type, dimensions: int) -> Any:
    """Return the function that makes an array of what NumPy's header says."""
    kind = types.Array(dtype, dimensions, "C")

    @intrinsic
    def view(context, header):  # noqa: ARG001
        def generate(context, builder, signature, values):  # noqa: ARG001
            def at(base, k):
                return builder.load(builder.gep(base, [ir.Constant(WORD, k)]))

            item = context.get_data_type(dtype)
            head = builder.inttoptr(values[0], WORD.as_pointer())
            lengths = builder.inttoptr(at(head, 2), WORD.as_pointer())
            shape = [at(lengths, k) for k in range(dimensions)]
            strides = [ir.Constant(WORD, context.get_abi_sizeof(item))]
            for length in shape[:0:-1]:
                strides.insert(0, builder.mul(strides[0], length))
            array = context.make_array(kind)(context, builder)
            populate_array(
                array,
                data=builder.inttoptr(at(head, 0), item.as_pointer()),
                shape=cgutils.pack_array(builder, shape),
                strides=cgutils.pack_array(builder, strides),
                itemsize=strides[-1],
                meminfo=None,
            )
            return array._getvalue()

        return kind(types.int64), generate

    return view


def entry_of(kernel: Any) -> Any:
    """Make the function of a table's address that calls a kernel; its first word is `head`."""
    names: dict[str, Any] = {"kernel": kernel, "word": word, "real": real, "fits": fits}
    checks, places = [], count(1)

    def argument(kind: Any) -> str:
        if hasattr(kind, "_fields"):
            parts = get_type_hints(kind, include_extras=True).values()
            return f"({', '.join(map(argument, parts))},)"
        if getattr(kind, "__origin__", None) is tuple:
            return f"({', '.join(map(argument, get_args(kind)))},)"
        at = f"table + {8 * next(places)}"
        if kind in (int, bool, float):
            return {int: f"word({at})", bool: f"(word({at}) != 0)", float: f"real({at})"}[kind]
        array, (dimensions,) = get_args(get_args(kind)[0])[1], kind.__metadata__
        dtype = from_dtype(get_args(array)[0])
        letters = LETTERS[str(dtype)]
        checks.append(f"fits(word({at}) + head, head, {dimensions}, {letters[0]}, {letters[-1]})")
        names[view := f"view{len(checks)}"] = viewer(dtype, dimensions)
        return f"{view}(word({at}) + head)"

    kinds = get_type_hints(kernel.py_func, include_extras=True)
    returns = kinds.pop("return", None)
    call = f"kernel({', '.join(map(argument, kinds.values()))})"
    text = f"""def entry(table):
    head = word(table)
    if not ({" and ".join(checks)}):
        return {REFUSED}
    {f"return {call}" if returns is int else f"{call}; return 0"}
"""
    exec(text, names)
    return names["entry"]
