/// @file
/// The block diagrams of the paper (Figs 1 and 2), as SVG.
#pragma once

#include <string>

namespace paper1 {

/// Boxes with text, and arrows between points, px.
class Diagram {
 public:
  Diagram(int width, int height)
      : svg_("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " + std::to_string(width) +
             " " + std::to_string(height) +
             "\" font-family=\"DejaVu Sans, Verdana, sans-serif\" font-size=\"14\" "
             "text-anchor=\"middle\">\n<defs><marker id=\"a\" viewBox=\"0 0 8 8\" refX=\"8\" "
             "refY=\"4\" markerWidth=\"8\" markerHeight=\"8\" orient=\"auto\"><path d=\"M0 0 8 4 0 "
             "8z\"/></marker></defs>\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n") {}

  /// A box around (x, y) with one or two lines of text.
  Diagram& box(int x, int y, int width, const std::string& text, const std::string& second = {}) {
    svg_ += "<rect x=\"" + at(x - width / 2) + "\" y=\"" + at(y - 26) + "\" width=\"" + at(width) +
            "\" height=\"52\" fill=\"#eef3fa\" stroke=\"#404040\"/>\n";
    words(x, second.empty() ? y + 5 : y - 4, text);
    return second.empty() ? *this : words(x, y + 15, second);
  }
  Diagram& words(int x, int y, const std::string& text) {
    svg_ += "<text x=\"" + at(x) + "\" y=\"" + at(y) + "\">" + text + "</text>\n";
    return *this;
  }
  /// A line through points "x,y x,y ..", with an arrow at its end.
  Diagram& arrow(const std::string& points) {
    svg_ += "<polyline points=\"" + points +
            "\" fill=\"none\" stroke=\"#000000\" marker-end=\"url(#a)\"/>\n";
    return *this;
  }
  [[nodiscard]] std::string svg() const { return svg_ + "</svg>\n"; }

 private:
  static std::string at(int pixels) { return std::to_string(pixels); }
  std::string svg_;
};

/// Fig. 1: the control loop with an extended state observer.
inline std::string loop_diagram() {
  return Diagram(860, 240)
      .words(30, 75, "y_d, ..")
      .arrow("62,70 110,70")
      .box(180, 70, 140, "feedback")
      .arrow("250,70 330,70")
      .words(290, 60, "v")
      .box(410, 70, 160, "u = (v - dhat) / ghat")
      .arrow("490,70 610,70")
      .words(575, 60, "u")
      .box(680, 70, 140, "plant")
      .words(680, 18, "d*")
      .arrow("680,24 680,44")
      .arrow("750,70 850,70")
      .words(825, 60, "y")
      .arrow("790,70 790,190 590,190")
      .words(690, 182, "y + noise w")
      .arrow("545,70 545,164")
      .box(500, 190, 180, "extended state", "observer")
      .arrow("440,164 440,96")
      .words(415, 135, "dhat")
      .arrow("410,190 180,190 180,96")
      .words(295, 182, "estimates of y, y', ..")
      .svg();
}

/// Fig. 2: the cascade.
inline std::string cascade_diagram() {
  return Diagram(860, 270)
      .words(55, 75, "y + noise w")
      .arrow("105,70 150,70")
      .box(230, 70, 160, "level 1, slow", "omega_1")
      .arrow("310,70 390,70")
      .words(350, 60, "its y")
      .box(470, 70, 160, "level 2", "alpha omega_1")
      .arrow("550,70 640,70")
      .words(590, 60, "its y")
      .box(710, 70, 140, "level p", "omega_p")
      .arrow("780,70 850,70")
      .words(820, 60, "y, y', ..")
      .words(55, 25, "u")
      .arrow("70,20 230,20 230,44")
      .arrow("230,20 470,20 470,44")
      .arrow("470,20 710,20 710,44")
      .arrow("230,96 230,180 390,180")
      .words(310, 172, "its disturbance")
      .arrow("470,96 470,154")
      .arrow("710,96 710,180 550,180")
      .box(470, 180, 160, "sum")
      .arrow("550,190 850,190")
      .words(740, 212, "dhat: what all levels found")
      .words(430, 250,
             "Level i also gets the disturbance estimates of the levels before it, as part of its "
             "input.")
      .svg();
}

}  // namespace paper1
