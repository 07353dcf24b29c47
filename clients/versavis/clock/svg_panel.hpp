// SPDX-License-Identifier: BSD-3-Clause
// Draws curves and clouds of points over axes as SVG; as small for a million points as for a
// thousand.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace versavis::client::svg {

struct Point {
    double x = 0;
    double y = 0;
};

struct Span {
    double low = 0;
    double high = 0;
};

/// Height of a band about a curve at `x`.
struct Bar {
    double x = 0;
    Span y;
};

struct Box {
    double left = 0;
    double top = 0;
    double width = 0;
    double height = 0;
};

enum class Anchor { start, middle, end };

/// For text and attributes; what XML does not allow becomes '?'.
std::string escaped(std::string_view text);

std::string text(double x, double y, std::string_view content, Anchor anchor, int size,
                 const char* colour = "#222");

/// Spans all values, with some room; when there are many, a share of `cut` is left out on each
/// side. Never empty.
Span span_of(std::vector<double> values, double cut = 0.005);

/// Round numbers within the span, `about` as many.
std::vector<double> ticks(Span span, int about);

/// With as many digits as ticks `step` apart need.
std::string tick_label(double value, double step);

class Panel {
 public:
    Panel(const Box& box, Span x, Span y) : box_(box), x_(x), y_(y) {}

    /// What lies outside the axes is cut off.
    void band(const std::vector<Bar>& bars, const char* colour);
    void line(const std::vector<Point>& points, const char* colour);

    /// Draws dots or, when they would cover each other, their range and its middle half per pixel.
    /// Returns how many lie outside the axes.
    std::size_t cloud(const std::vector<Point>& points, const char* colour);

    /// What was drawn, with frame, grid and ticks; an empty label leaves out the labels along x.
    std::string finished(const std::string& y_label, const std::string& x_label) const;

 private:
    double px(double x) const;
    double py(double y) const;
    std::size_t pixel(double x) const;
    std::size_t pixels() const { return static_cast<std::size_t>(box_.width) + 1; }
    void dots(const std::vector<Point>& points, const char* colour);
    void bars(const std::vector<Point>& points, const char* colour);
    std::string grid(bool x_labels) const;

    Box box_;
    Span x_;
    Span y_;
    std::string content_;
};

}  // namespace versavis::client::svg
