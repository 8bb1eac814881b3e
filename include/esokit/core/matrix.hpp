/// @file
/// Vectors and matrices of fixed size, for the public interface and the design work.
///
/// A controller needs no linear algebra library: these are arrays with an int subscript and the few
/// operations that the design takes. They convert to and from Eigen types, although no Eigen header
/// is included here. For all other operations `eigen(x)` of esokit/eigen.hpp gives an Eigen map
/// onto x.
#pragma once

#include <array>
#include <cassert>
#include <concepts>
#include <cstddef>
#include <esokit/core/detail/text.hpp>
#include <esokit/core/language.hpp>
#include <type_traits>
#include <utility>

namespace esokit {

template <class ScalarType, int Rows, int Columns>
class Matrix;

namespace detail {

/// Has its sizes as enumerators or constants, as the dense types of Eigen do; -1 means that the
/// size is known at run time only.
template <class T>
concept DenseSizes = requires {
  typename T::Scalar;
  static_cast<int>(T::RowsAtCompileTime);
  static_cast<int>(T::ColsAtCompileTime);
};

template <class T, class ScalarType, int Rows, int Columns>
concept DenseOfSize = DenseSizes<T> && std::same_as<typename T::Scalar, ScalarType> &&
                      (static_cast<int>(T::RowsAtCompileTime) == Rows ||
                       static_cast<int>(T::RowsAtCompileTime) < 0) &&
                      (static_cast<int>(T::ColsAtCompileTime) == Columns ||
                       static_cast<int>(T::ColsAtCompileTime) < 0);

/// An Eigen expression, evaluated.
template <class T>
decltype(auto) evaluated(const T& expression) requires requires {
  expression.eval().coeff(0, 0);
}
{ return expression.eval(); }

/// The same for a diagonal or triangular expression.
template <class T>
auto evaluated(const T& expression) requires requires {
  expression.toDenseMatrix().coeff(0, 0);
}
{ return expression.toDenseMatrix(); }

/// Any Eigen expression.
template <class T>
concept DenseExpression = DenseSizes<T> && requires(const T& expression) {
  detail::evaluated(expression);
  static_cast<int>(expression.rows());
  static_cast<int>(expression.cols());
};

/// An Eigen matrix, vector or array that owns its elements.
template <class T>
concept DenseStorage = DenseSizes<T> && std::default_initializable<T> && requires(T& storage) {
  storage.resize(1, 1);
  storage.coeffRef(0, 0) = typename T::Scalar();
};

/// Number of elements of a column vector, of Eigen or of esokit; 0 for all other types.
template <class T>
inline constexpr int vector_size = 0;

template <DenseExpression T>
requires(static_cast<int>(T::ColsAtCompileTime) == 1 &&
         static_cast<int>(T::RowsAtCompileTime) >
             0) inline constexpr int vector_size<T> = static_cast<int>(T::RowsAtCompileTime);

template <class ScalarType, int Size>
inline constexpr int vector_size<Matrix<ScalarType, Size, 1>> = Size;

/// Converts to a Vector of its own size: an argument of functions that accept any size.
template <class T, class ScalarType>
concept VectorOf = vector_size<T> >
0 && std::convertible_to<const T&, Matrix<ScalarType, vector_size<T>, 1>>;

/// S, whatever the int is: expanded over a pack of ints, it lists as many parameters as there are
/// elements.
template <class S, int>
struct Repeated {
  using type = S;  ///< S
};

/// A row in braces.
template <class S, int Columns>
using ListedRow = S[static_cast<std::size_t>(Columns)];

/// The elements, column by column, and the constructors that list them. The number of elements is
/// part of the constructor's signature, so that the compiler refuses a wrong number and a narrowing
/// conversion.
template <class S, int Rows, int Columns, class Places>
class MatrixElements;

template <class S, int Rows, int Columns, int... Place>
requires(Rows == 1 || Columns == 1)  //
    class MatrixElements<S, Rows, Columns, std::integer_sequence<int, Place...>> {
 public:
  constexpr MatrixElements() = default;

  explicit(sizeof...(Place) == 1) constexpr MatrixElements(
      const typename Repeated<S, Place>::type&... elements) noexcept
      : elements_{elements...} {}

  constexpr MatrixElements(
      const ListedRow<S, static_cast<int>(sizeof...(Place))>& elements) noexcept
      requires(sizeof...(Place) > 1)
      : elements_{elements[Place]...} {}

 protected:
  std::array<S, sizeof...(Place)> elements_{};
};

template <class S, int Rows, int Columns, int... Row>
requires(Rows > 1 && Columns > 1)  //
    class MatrixElements<S, Rows, Columns, std::integer_sequence<int, Row...>> {
 public:
  constexpr MatrixElements() = default;

  constexpr MatrixElements(
      const typename Repeated<ListedRow<S, Columns>, Row>::type&... rows) noexcept {
    (fill(Row, rows), ...);
  }

 protected:
  std::array<S, static_cast<std::size_t>(Rows) * Columns> elements_{};

 private:
  constexpr void fill(int i, const ListedRow<S, Columns>& row) noexcept {
    for (int j = 0; j < Columns; ++j) elements_[static_cast<std::size_t>(j * Rows + i)] = row[j];
  }
};

template <class S, int Rows, int Columns>
using MatrixBase =
    MatrixElements<S, Rows, Columns, std::make_integer_sequence<int, Rows == 1 ? Columns : Rows>>;

}  // namespace detail

/// Matrix of `Rows` x `Columns` elements, zero unless listed: `{a, b, c}` for a vector, `{{a, b},
/// {c, d}}` by rows. An index out of bounds is caught by an assertion.
///
/// It converts from and to Eigen types of the same scalar, of this size or of a size known at run
/// time: `Eigen::Vector3d z = observer.estimate()`.
template <class ScalarType, int Rows, int Columns>
class Matrix : public detail::MatrixBase<ScalarType, Rows, Columns> {
  using Base = detail::MatrixBase<ScalarType, Rows, Columns>;
  using Base::elements_;
  static constexpr int count = Rows * Columns;
  static constexpr bool is_vector = Rows == 1 || Columns == 1;

 public:
  using value_type = ScalarType;  ///< type of an element

  using Base::Base;
  /// All elements zero.
  constexpr Matrix() = default;

  /// From an Eigen expression; if its size is known at run time only, it must have this size.
  template <detail::DenseExpression Expression>
  requires detail::DenseOfSize<Expression, ScalarType, Rows, Columns> Matrix(
      const Expression& expression) {
    assert(expression.rows() == Rows && expression.cols() == Columns);
    const auto& values = detail::evaluated(expression);
    for (int j = 0; j < Columns; ++j) {
      for (int i = 0; i < Rows; ++i) (*this)(i, j) = values.coeff(i, j);
    }
  }

  /// To an Eigen type that owns its elements.
  template <detail::DenseStorage Storage>
  requires detail::DenseOfSize<Storage, ScalarType, Rows, Columns>
  operator Storage() const {
    Storage storage;
    storage.resize(Rows, Columns);
    for (int j = 0; j < Columns; ++j) {
      for (int i = 0; i < Rows; ++i) storage.coeffRef(i, j) = (*this)(i, j);
    }
    return storage;
  }

  /// The only element.
  constexpr operator ScalarType() const noexcept requires(count == 1) { return elements_[0]; }

  /// @name Special matrices
  /// @{
  static constexpr Matrix Constant(const ScalarType& value) noexcept {
    Matrix result;
    for (ScalarType& element : result) element = value;
    return result;
  }
  /// Zero except for the diagonal: `Covariance::Diagonal({1e-4, 1, 1e3})`.
  static constexpr Matrix Diagonal(const Matrix<ScalarType, Rows, 1>& elements) noexcept
      requires(Rows == Columns) {
    Matrix result = Zero();
    for (int i = 0; i < Rows; ++i) result(i, i) = elements(i);
    return result;
  }
  static constexpr Matrix Zero() noexcept { return Constant(ScalarType(0.0)); }
  static constexpr Matrix Identity() noexcept {
    Matrix result = Zero();
    for (int i = 0; i < Rows && i < Columns; ++i) result(i, i) = ScalarType(1.0);
    return result;
  }
  /// @}

  /// Sizes.
  /// @{
  static constexpr int rows() noexcept { return Rows; }
  static constexpr int cols() noexcept { return Columns; }
  static constexpr int size() noexcept { return count; }
  /// @}

  /// @name Elements
  /// @{
  [[nodiscard]] constexpr ScalarType& operator()(int i, int j) noexcept {
    return elements_[place(i, j)];
  }
  [[nodiscard]] constexpr const ScalarType& operator()(int i, int j) const noexcept {
    return elements_[place(i, j)];
  }
  [[nodiscard]] constexpr ScalarType& operator()(int i) noexcept requires is_vector {
    return elements_[place(i)];
  }
  [[nodiscard]] constexpr const ScalarType& operator()(int i) const noexcept requires is_vector {
    return elements_[place(i)];
  }
  [[nodiscard]] constexpr ScalarType& operator[](int i) noexcept requires is_vector {
    return elements_[place(i)];
  }
  [[nodiscard]] constexpr const ScalarType& operator[](int i) const noexcept requires is_vector {
    return elements_[place(i)];
  }

  /// The elements, column by column.
  [[nodiscard]] constexpr ScalarType* data() noexcept { return elements_.data(); }
  [[nodiscard]] constexpr const ScalarType* data() const noexcept { return elements_.data(); }
  [[nodiscard]] constexpr ScalarType* begin() noexcept { return data(); }
  [[nodiscard]] constexpr ScalarType* end() noexcept { return data() + count; }
  [[nodiscard]] constexpr const ScalarType* begin() const noexcept { return data(); }
  [[nodiscard]] constexpr const ScalarType* end() const noexcept { return data() + count; }

  /// `Length` elements of a vector, from `first` on.
  template <int Length>
  [[nodiscard]] constexpr auto segment(int first) const noexcept requires is_vector {
    Matrix<ScalarType, Rows == 1 ? 1 : Length, Rows == 1 ? Length : 1> part;
    for (int i = 0; i < Length; ++i) part(i) = (*this)(first + i);
    return part;
  }
  /// The first `Length` elements of a vector.
  template <int Length>
  [[nodiscard]] constexpr auto head() const noexcept requires is_vector {
    static_assert(Length <= count);
    return segment<Length>(0);
  }
  /// @}

  /// @name Operations
  /// @{
  [[nodiscard]] constexpr Matrix<ScalarType, 1, Columns> row(int i) const noexcept {
    Matrix<ScalarType, 1, Columns> part;
    for (int j = 0; j < Columns; ++j) part(j) = (*this)(i, j);
    return part;
  }
  [[nodiscard]] constexpr Matrix<ScalarType, Rows, 1> col(int j) const noexcept {
    Matrix<ScalarType, Rows, 1> part;
    for (int i = 0; i < Rows; ++i) part(i) = (*this)(i, j);
    return part;
  }
  /// Sum of all elements.
  [[nodiscard]] constexpr ScalarType sum() const noexcept {
    ScalarType total = elements_[0];
    for (int i = 1; i < count; ++i) total = total + data()[i];
    return total;
  }
  /// Sum of the diagonal.
  [[nodiscard]] constexpr ScalarType trace() const noexcept {
    ScalarType total = elements_[0];
    for (int i = 1; i < Rows && i < Columns; ++i) total = total + (*this)(i, i);
    return total;
  }
  [[nodiscard]] constexpr Matrix<ScalarType, Columns, Rows> transpose() const noexcept {
    Matrix<ScalarType, Columns, Rows> result;
    for (int j = 0; j < Columns; ++j) {
      for (int i = 0; i < Rows; ++i) result(j, i) = (*this)(i, j);
    }
    return result;
  }
  /// Scalar product.
  [[nodiscard]] constexpr ScalarType dot(const Matrix& other) const noexcept requires is_vector {
    ScalarType sum = (*this)(0) * other(0);
    for (int i = 1; i < count; ++i) sum = sum + (*this)(i)*other(i);
    return sum;
  }

  constexpr Matrix& operator+=(const Matrix& other) noexcept {
    for (int i = 0; i < count; ++i) data()[i] = data()[i] + other.data()[i];
    return *this;
  }
  constexpr Matrix& operator-=(const Matrix& other) noexcept {
    for (int i = 0; i < count; ++i) data()[i] = data()[i] - other.data()[i];
    return *this;
  }
  constexpr Matrix& operator*=(const ScalarType& factor) noexcept {
    for (ScalarType& element : *this) element = element * factor;
    return *this;
  }
  constexpr Matrix& operator/=(const ScalarType& divisor) noexcept {
    for (ScalarType& element : *this) element = element / divisor;
    return *this;
  }

  friend constexpr Matrix operator+(Matrix a, const Matrix& b) noexcept { return a += b; }
  friend constexpr Matrix operator-(Matrix a, const Matrix& b) noexcept { return a -= b; }
  friend constexpr Matrix operator-(Matrix a) noexcept {
    for (ScalarType& element : a) element = -element;
    return a;
  }
  friend constexpr Matrix operator*(Matrix a, const ScalarType& factor) noexcept {
    return a *= factor;
  }
  friend constexpr Matrix operator*(const ScalarType& factor, Matrix a) noexcept {
    return a *= factor;
  }
  friend constexpr Matrix operator/(Matrix a, const ScalarType& divisor) noexcept {
    return a /= divisor;
  }
  friend constexpr bool operator==(const Matrix& a, const Matrix& b) noexcept {
    for (int i = 0; i < count; ++i) {
      if (!(a.data()[i] == b.data()[i])) return false;
    }
    return true;
  }
  /// @}

 private:
  static constexpr std::size_t place(int i) noexcept {
    assert(i >= 0 && i < count);
    return static_cast<std::size_t>(i);
  }
  static constexpr std::size_t place(int i, int j) noexcept {
    assert(i >= 0 && i < Rows && j >= 0 && j < Columns);
    return static_cast<std::size_t>(j * Rows + i);
  }
};

/// Column vector of `Size` elements.
template <class ScalarType, int Size>
using Vector = Matrix<ScalarType, Size, 1>;

namespace detail {}  // namespace detail

/// Row vector of `Size` elements.
template <class ScalarType, int Size>
using RowVector = Matrix<ScalarType, 1, Size>;

/// The product of two matrices.
template <class ScalarType, int Rows, int Inner, int Columns>
constexpr Matrix<ScalarType, Rows, Columns> operator*(
    const Matrix<ScalarType, Rows, Inner>& a,
    const Matrix<ScalarType, Inner, Columns>& b) noexcept {
  Matrix<ScalarType, Rows, Columns> result;
  for (int j = 0; j < Columns; ++j) {
    for (int i = 0; i < Rows; ++i) {
      ScalarType sum = a(i, 0) * b(0, j);
      for (int k = 1; k < Inner; ++k) sum = sum + a(i, k) * b(k, j);
      result(i, j) = sum;
    }
  }
  return result;
}

/// The same if one of them is an Eigen expression.
/// @{
template <detail::DenseExpression Expression, class ScalarType, int Inner, int Columns>
requires(static_cast<int>(Expression::RowsAtCompileTime) > 0)  //
    Matrix < ScalarType,
    static_cast<int>(Expression::RowsAtCompileTime)
, Columns > operator*(const Expression& a, const Matrix<ScalarType, Inner, Columns>& b) {
  return Matrix<ScalarType, static_cast<int>(Expression::RowsAtCompileTime), Inner>(a) * b;
}
template <detail::DenseExpression Expression, class ScalarType, int Rows, int Inner>
requires(static_cast<int>(Expression::ColsAtCompileTime) > 0)  //
    Matrix < ScalarType,
    Rows, static_cast<int>(Expression::ColsAtCompileTime)
> operator*(const Matrix<ScalarType, Rows, Inner>& a, const Expression& b) {
  return a * Matrix<ScalarType, Inner, static_cast<int>(Expression::ColsAtCompileTime)>(b);
}
/// @}

/// A Matrix can be written to a stream, see has_text.
template <class ScalarType, int Rows, int Columns>
inline constexpr bool has_text<Matrix<ScalarType, Rows, Columns>> = true;

/// Writes one line for each row.
template <class Stream, class ScalarType, int Rows, int Columns>
requires detail::WritesText<Stream, ScalarType> Stream& operator<<(
    Stream& out, const Matrix<ScalarType, Rows, Columns>& matrix) {
  for (int i = 0; i < Rows; ++i) {
    if (i != 0) out << "\n";
    for (int j = 0; j < Columns; ++j) {
      if (j != 0) out << " ";
      out << matrix(i, j);
    }
  }
  return out;
}

}  // namespace esokit
