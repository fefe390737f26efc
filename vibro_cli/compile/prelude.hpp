// The basis of the kernels in C++: arrays, numbers in lanes, and Python's arithmetic.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#ifdef __x86_64__
#include <cpuid.h>
#endif

#define EXPORTED __attribute__((visibility("default")))
// For functions that take or return many lanes: a call would pass all their registers in memory.
#define IN_PLACE static inline __attribute__((always_inline))

// Bounds are checked only in the build for tests (see tests/sanitize.py).
#ifndef CHECK_BOUNDS
#define CHECK_BOUNDS 0
#endif
static inline void check(int64_t index, int64_t count) {
  if (CHECK_BOUNDS && (index < 0 || index >= count)) {
    std::fprintf(stderr, "kernels: index %lld of %lld\n", (long long)index, (long long)count);
    std::abort();
  }
}

// An array in C order, in memory that Python owns; an index gives an element, or a subarray with
// one axis less.
template <class Item, int axes>
struct Array {
  Item* first;
  int64_t extents[axes];
  decltype(auto) operator[](int64_t index) const {
    check(index, extents[0]);
    if constexpr (axes > 1) {
      Array<Item, axes - 1> part{first};
      int64_t stride = 1;
      for (int axis = 1; axis < axes; axis++) stride *= part.extents[axis - 1] = extents[axis];
      part.first += index * stride;
      return part;
    } else {
      return (first[index]);
    }
  }
};

// Numbers in lanes, in as many registers of the processor as they need: for a vector longer than a
// register, g++ would compute comparisons, choices and roots number by number.
#if defined(__AVX512F__)
static constexpr int REGISTER = 8;
#elif defined(__AVX__)
static constexpr int REGISTER = 4;
#else
static constexpr int REGISTER = 2;
#endif
template <class Number, int count>
struct InLanes {
  static constexpr int width = count < REGISTER ? count : REGISTER, parts = count / width;
  typedef Number Part __attribute__((vector_size(8 * width), aligned(8)));
  Part part[parts];
  Number operator[](int64_t lane) const { return part[lane / width][lane % width]; }
};
template <int count>
using Lanes = InLanes<double, count>;
template <int count>
using Mask = InLanes<int64_t, count>;  // in each lane all bits are set, or none

template <class Result, class Function>
static inline Result by_parts(Function part) {
  Result result;
  for (int at = 0; at < Result::parts; at++) result.part[at] = part(at);
  return result;
}
#define BY_PARTS(Result, sign, Given)                                                   \
  template <int count>                                                                  \
  static inline Result<count> operator sign(Given<count> a, Given<count> b) {           \
    return by_parts<Result<count>>([&](int at) { return a.part[at] sign b.part[at]; }); \
  }
BY_PARTS(Lanes, +, Lanes)
BY_PARTS(Lanes, -, Lanes)
BY_PARTS(Lanes, *, Lanes)
BY_PARTS(Lanes, /, Lanes)
BY_PARTS(Mask, <, Lanes)
BY_PARTS(Mask, <=, Lanes)
BY_PARTS(Mask, >, Lanes)
BY_PARTS(Mask, >=, Lanes)
BY_PARTS(Mask, ==, Lanes)
BY_PARTS(Mask, !=, Lanes)
BY_PARTS(Mask, &, Mask)
BY_PARTS(Mask, |, Mask)
template <int count>
static inline Lanes<count> operator-(Lanes<count> a) {
  return by_parts<Lanes<count>>([&](int at) { return -a.part[at]; });
}
template <int count>
static inline Mask<count> operator!(Mask<count> a) {
  return by_parts<Mask<count>>([&](int at) { return ~a.part[at]; });
}

namespace py {

template <int count>
static inline Lanes<count> in_all(double value) {
  typedef typename Lanes<count>::Part Part;
  return by_parts<Lanes<count>>([&](int) { return value - Part{}; });  // -0.0 too
}
template <int count>
static inline Mask<count> mask_in_all(bool value) {
  typedef typename Mask<count>::Part Part;
  return by_parts<Mask<count>>([&](int) { return Part{} - (int64_t)value; });
}
template <class Number>
static inline Number select(bool condition, Number yes, Number no) {
  return condition ? yes : no;
}
template <int count>
static inline Lanes<count> select(Mask<count> condition, Lanes<count> yes, Lanes<count> no) {
  return by_parts<Lanes<count>>(
      [&](int at) { return condition.part[at] ? yes.part[at] : no.part[at]; });
}
static inline double sqrt(double value) { return __builtin_sqrt(value); }
template <class Part>
static inline Part root_of(Part part) {
#ifdef __AVX__  // compilers turn the loop into scalar roots; the intrinsics' header is long
  __asm__("vsqrtpd %1, %0" : "=v"(part) : "v"(part));
#else
  for (int at = 0; at < int(sizeof part / 8); at++) part[at] = __builtin_sqrt(part[at]);
#endif
  return part;
}
template <int count>
static inline Lanes<count> sqrt(Lanes<count> lanes) {
  return by_parts<Lanes<count>>([&](int at) { return root_of(lanes.part[at]); });
}
static inline double abs(double value) { return std::fabs(value); }
static inline int64_t abs(int64_t value) { return value < 0 ? -value : value; }
template <int count>
static inline Lanes<count> abs(Lanes<count> lanes) {
  typedef typename Lanes<count>::Part Part;
  typedef typename Mask<count>::Part Bits;
  return by_parts<Lanes<count>>(
      [&](int at) { return (Part)((Bits)lanes.part[at] & ~(Bits)(-0.0 - Part{})); });
}
static inline bool has_bit(double value, int64_t bit) { return ((int64_t)value & bit) != 0; }
template <int count>
static inline Mask<count> has_bit(Lanes<count> lanes, int64_t bit) {
  typedef typename Mask<count>::Part Bits;
  return by_parts<Mask<count>>([&](int at) {
    return (__builtin_convertvector(lanes.part[at], Bits) & (Bits{} + bit)) != Bits{};
  });
}
template <int count>
static inline Lanes<count> insert(Lanes<count> lanes, int64_t number, double value) {
#ifdef __AVX__  // writing one number to a register's memory would stall the next read of all
  typedef typename Lanes<count>::Part Part;
  typename Mask<count>::Part place;
  for (int lane = 0; lane < lanes.width; lane++) place[lane] = lane;
  return by_parts<Lanes<count>>([&](int at) {
    return place == number - at * lanes.width ? value - Part{} : lanes.part[at];
  });
#else
  lanes.part[number / lanes.width][number % lanes.width] = value;
  return lanes;
#endif
}
static inline Lanes<2> pack(double first, double second) {
  return by_parts<Lanes<2>>([&](int) { return Lanes<2>::Part{first, second}; });
}
static inline bool any_lane(bool value) { return value; }
template <int count>
static inline bool any_lane(Mask<count> mask) {
  auto any = mask.part[0];
  for (int at = 1; at < mask.parts; at++) any |= mask.part[at];
#ifdef __AVX512F__
  if constexpr (sizeof any == 64) {
    uint8_t set;
    __asm__("vptestmq %1, %1, %0" : "=k"(set) : "v"(any));
    return set != 0;
  }
#endif
  int64_t bits = 0;
  for (int lane = 0; lane < mask.width; lane++) bits |= any[lane];
  return bits != 0;
}

// Python's min and max, which return the first argument unless another one is beyond it.
template <class Number, class... More>
static inline Number min(Number one, Number other, More... more) {
  Number least = py::select(other < one, other, one);
  if constexpr (sizeof...(more) > 0) least = py::min<Number>(least, more...);
  return least;
}
template <class Number, class... More>
static inline Number max(Number one, Number other, More... more) {
  Number greatest = py::select(other > one, other, one);
  if constexpr (sizeof...(more) > 0) greatest = py::max<Number>(greatest, more...);
  return greatest;
}
// Python's % and //, which round towards minus infinity.
static inline int64_t mod(int64_t one, int64_t other) {
  int64_t rest = one % other;
  return rest != 0 && ((rest < 0) != (other < 0)) ? rest + other : rest;
}
static inline double mod(double one, double other) {
  double rest = std::fmod(one, other);
  if (rest == 0) return std::copysign(0.0, other);
  return (rest < 0) != (other < 0) ? rest + other : rest;
}
static inline int64_t floordiv(int64_t one, int64_t other) {
  return (one - mod(one, other)) / other;
}
}  // namespace py

// The level of x86-64 that processor and system support, 2 to 4 (see native.py); 0 on others.
extern "C" EXPORTED __attribute__((used)) inline int kernels_level() {
#ifdef __x86_64__
  unsigned a, b, c, d, state, more;
  if (!__get_cpuid(1, &a, &b, &c, &d)) return 2;
  bool kept = c & (1u << 27);  // the system saves registers beyond those of level 2
  bool fused = c & (1u << 12);
  if (!kept || !fused || !__get_cpuid_count(7, 0, &a, &b, &c, &d)) return 2;
  __asm__("xgetbv" : "=a"(state), "=d"(more) : "c"(0));
  const unsigned level_3 = 1u << 3 | 1u << 5 | 1u << 8;  // BMI1, AVX2, BMI2
  const unsigned level_4 = 1u << 16 | 1u << 17 | 1u << 28 | 1u << 30 | 1u << 31;  // F DQ CD BW VL
  if ((b & level_3) != level_3 || (state & 0x06) != 0x06) return 2;
  return (b & level_4) == level_4 && (state & 0xe6) == 0xe6 ? 4 : 3;
#else
  return 0;
#endif
}
