#include "board.h"
#include "firmware.h"

int main(void)
{
    board_init();
    firmware_init();
    board_mask(false);
    for (;;) {
        firmware_poll();
    }
}
