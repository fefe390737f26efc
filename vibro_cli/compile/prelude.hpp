// What kernels in C++ are made of: arrays, tuples, numbers in lanes, and Python's arithmetic.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#ifdef __x86_64__
#include <cpuid.h>
#include <immintrin.h>
#endif

#define EXPORTED __attribute__((visibility("default")))

// Bounds are checked in the build for tests only (see tests/sanitize.py).
#ifndef CHECK_BOUNDS
#define CHECK_BOUNDS 0
#endif
static inline void check(int64_t index, int64_t count) {
  if (CHECK_BOUNDS && (index < 0 || index >= count)) {
    std::fprintf(stderr, "kernels: index %lld of %lld\n", (long long)index, (long long)count);
    std::abort();
  }
}

// An array in C order, whose memory Python keeps; its elements, or its parts of one axis less.
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

// Numbers in lanes: vectors that the compiler keeps in registers.
template <int count>
struct Vectors {
  typedef double Real __attribute__((vector_size(8 * count)));
  typedef int64_t Truth __attribute__((vector_size(8 * count)));
  typedef double Field __attribute__((vector_size(8 * count), aligned(8)));
};
template <int count>
using Lanes = typename Vectors<count>::Real;
template <int count>
using Mask = typename Vectors<count>::Truth;
template <int count>
using Unaligned = typename Vectors<count>::Field;  // as a field of a struct in an array

namespace py {

template <int count>
static inline Lanes<count> in_all(double value) {
  return value - Lanes<count>{};  // which is the value, -0.0 too
}
template <int count>
static inline Mask<count> in_all(bool value) {
  return Mask<count>{} - (int64_t)value;
}
template <class Real>
static constexpr int count_of = sizeof(Real) / sizeof(double);
static inline double sqrt(double value) { return __builtin_sqrt(value); }
template <class Real>
static inline Real sqrt(Real lanes) {
#if __has_builtin(__builtin_elementwise_sqrt)  // clang, and g++, make scalar roots of the loop
  return __builtin_elementwise_sqrt(lanes);
#else
#ifdef __AVX512F__
  if constexpr (sizeof(Real) == 64) return (Real)_mm512_sqrt_pd((__m512d)lanes);
#endif
#ifdef __AVX__
  if constexpr (sizeof(Real) == 32) return (Real)_mm256_sqrt_pd((__m256d)lanes);
#endif
  for (int lane = 0; lane < count_of<Real>; lane++) lanes[lane] = __builtin_sqrt(lanes[lane]);
  return lanes;
#endif
}
static inline double abs(double value) { return std::fabs(value); }
static inline int64_t abs(int64_t value) { return value < 0 ? -value : value; }
template <class Real>
static inline Real abs(Real lanes) {
  typedef Mask<count_of<Real>> Bits;
  return (Real)((Bits)lanes & ~(Bits)in_all<count_of<Real>>(-0.0));
}
static inline bool has_bit(double value, int64_t bit) { return ((int64_t)value & bit) != 0; }
template <class Real>
static inline auto has_bit(Real lanes, int64_t bit) {
  typedef Mask<count_of<Real>> Bits;
  return (__builtin_convertvector(lanes, Bits) & (Bits{} + bit)) != Bits{};
}
template <class Real>
static inline Real with_lane(Real lanes, int64_t number, double value) {
  lanes[number] = value;
  return lanes;
}
static inline bool any_lane(bool value) { return value; }
template <class Truth>
static inline bool any_lane(Truth mask) {
#ifdef __AVX512F__
  if constexpr (sizeof(Truth) == 64) {
    return _mm512_test_epi64_mask((__m512i)mask, (__m512i)mask) != 0;
  }
#endif
  int64_t any = 0;
  for (int lane = 0; lane < count_of<Truth>; lane++) any |= mask[lane];
  return any != 0;
}

// min and max as Python has them: the first one unless another is beyond it.
template <class Number, class... More>
static inline Number min(Number one, Number other, More... more) {
  Number least = other < one ? other : one;
  if constexpr (sizeof...(more) > 0) least = py::min<Number>(least, more...);
  return least;
}
template <class Number, class... More>
static inline Number max(Number one, Number other, More... more) {
  Number greatest = other > one ? other : one;
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
  return rest != 0 && ((rest < 0) != (other < 0)) ? rest + other : rest;
}
static inline int64_t floordiv(int64_t one, int64_t other) {
  return (one - mod(one, other)) / other;
}

// The results of an entry point, in eight bytes each.
template <class Value>
static inline void keep(int64_t* results, Value value) {
  std::memcpy(results, &value, sizeof value);
}
}  // namespace py

// Which level of x86-64 the processor and the system have, 2 to 4 (see build.py); 0 on others.
static inline int processor_level() {
#ifdef __x86_64__
  unsigned a, b, c, d, state, more;
  if (!__get_cpuid(1, &a, &b, &c, &d)) return 2;
  bool kept = c & (1u << 27);  // the system keeps registers beyond those of level 2
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
