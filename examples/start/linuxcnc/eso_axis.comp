component eso_axis "A position loop by ADRC: the C file that esokit's to_c writes, as a HAL component.";
description """
loop.h and loop.c are those of to_c, beside this file. The period of the thread has to be the sample
time of the design; with another one the output is zero. So it is while enable is FALSE; on enable
the loop takes over the axis where it stands, at rest under no output.""";
pin in float position "measured; NaN if there is none";
pin in float command "the reference";
pin in bit enable;
pin out float output "to the drive, within the limits of the design";
pin out float disturbance "as estimated, unit of the acceleration";
pin out unsigned sample_status "the flags of loop.h";
pin out unsigned loop_mode "0 the law, 1 the start hold, 2 measurements are missing";
pin out bit wrong_period;
variable loop_state loop;
variable int running = 0;
include "loop.c";
function _ fp;
license "MIT";
;;
FUNCTION(_)
{
  const double late = (double)period / ((double)LOOP_SAMPLE_TIME * 1e9) - 1.0;
  const float y = (float)position;
  wrong_period = (late > 1e-3) || (late < -1e-3);
  output = 0.0;
  if (!enable || wrong_period) {
    running = 0;
    return;
  }
  if (!running) {
    loop_init(&loop);
    sample_status = loop_start(&loop, y, 0.0f);
    if (sample_status != 0u) { /* the position is not good yet */
      return;
    }
    running = 1;
  }
  output = loop_update(&loop, y, (float)command);
  sample_status = loop.status;
  loop_mode = loop.mode;
  disturbance = loop_estimate(&loop, 2u);
}
